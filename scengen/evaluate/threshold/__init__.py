"""Where a policy breaks: the level of a shift at which its success falls to one half, from few rollouts."""
