"""Everything that a person does at the prompt besides single lines: macros, files, questions, raw mode."""
