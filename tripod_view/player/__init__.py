"""Pictures of a motion: a film of named arrays, as one HTML page that plays it, without ROS and without a network."""
