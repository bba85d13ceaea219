"""Teleoperation: a person drives the robot with a gamepad or a keyboard, and each take becomes a demonstration."""
