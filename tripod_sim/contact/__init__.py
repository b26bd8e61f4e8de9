"""Contact: broad phase, proximity and continuous detection, response by penalty or multipliers with friction."""
