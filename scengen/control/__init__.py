"""The control loop, compiled: operational-space controller, teleoperation filter, MuJoCo called directly."""
