"""A model to what makes its steps."""
