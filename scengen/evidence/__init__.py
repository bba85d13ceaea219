"""Evidence about tasks: their stored behaviour, and the figures that were measured on them."""
