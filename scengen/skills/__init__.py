"""Skills: moves that oracles and shortcuts are made of."""
