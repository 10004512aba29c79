"""One control period of an environment in its order: reset, actuation, sensor, reward, observation."""
