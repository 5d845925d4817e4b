"""What drives do and say, published to an existing MQTT broker. Nothing is commanded through it."""
