"""Looks: textures, materials, lights and surroundings of a scene, which pictures alone show."""
