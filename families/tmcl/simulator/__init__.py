"""The simulated TMCL module (personality TMCM): a one-axis stepper module with an open loop, in direct mode."""
