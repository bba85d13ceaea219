"""Demonstrations: scripted solutions in several styles, generated, verified and measured."""
