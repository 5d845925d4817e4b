"""What every room stands on: errors, text, files, places, records by name. It knows no drive, no line and no screen."""
