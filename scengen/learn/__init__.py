"""Small state-based policies trained by imitation: data, features, training, and playing in plain numpy."""
