"""A search for OOD axes: regions outside training in which an object-centric memory fails and the oracle does not."""
