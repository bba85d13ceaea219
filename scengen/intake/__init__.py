"""A user's mesh becomes an asset: read and checked, cut into convex pieces, measured, dropped, written."""
