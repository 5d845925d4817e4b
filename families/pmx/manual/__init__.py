"""The languages of PMX controllers, which host and simulator share: ASCII commands, A-SCRIPT, refusals, status."""
