"""The simulated MCode drives: Lexium MDrive, Lexium Motion Module and MDrivePlus.

`state` holds memory and runs the program, `motion` is the motor, `power` the supply and the memory that lasts,
`event_loop` lets time pass, `language` carries out lines, and `device` puts it together for the `ports`.
"""
