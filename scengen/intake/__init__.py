"""Conversion of a user's mesh to an asset: it is checked, cut into convex pieces, measured, dropped and written."""
