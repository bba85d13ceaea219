"""Robots: the Panda arm in robosuite's layout, its hands, and its inverse kinematics."""
