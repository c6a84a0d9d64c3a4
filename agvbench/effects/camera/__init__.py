"""Effects of the camera system: markers, scale, time stamps."""
