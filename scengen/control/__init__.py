"""Control: the compiled loop that runs robosuite's controller, and the teleoperation filter before it."""
