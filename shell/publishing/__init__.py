"""Samples, states, errors and transcripts of drives, for an existing MQTT broker, which commands no drive."""
