"""The language of MCode drives, which host and simulator share: grammar, tables, errors, help, program files."""
