"""MCode: the language of Lexium MDrive, Lexium Motion Module and MDrivePlus."""
