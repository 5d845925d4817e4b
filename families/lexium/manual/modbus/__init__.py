"""The register map of the Ethernet drives, which host and simulator share."""
