"""What a scene costs: stages of a step, memory, effects that are absent. Nothing of it is imported by a simulation."""
