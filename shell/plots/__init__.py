"""What is plotted, and values of drives in rows."""
