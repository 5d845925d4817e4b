"""The simulated MCode drives: Lexium MDrive, Lexium Motion Module and MDrivePlus.

`state` is what a drive remembers, `motion` what its motor does, `language` what its lines say. `nvm` and `power` keep
and restart all of it, `event_loop` lets time pass, and `device` puts it together for the `ports`.
"""
