"""Embodiments: the robot that is put into a scene, its controller, and the filter before the controller."""
