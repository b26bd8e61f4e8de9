"""The rigid ball: rolling, friction, impacts; on a moving plate with walls and holes, or on the soft body itself."""
