"""The simulated life: the whole program under one clock, judged by rules. `make simulate` lives seeds.

From the top: `runs` live many seeds; `living` puts one together; `story` tells its acts; `lives` begin and end the
processes of its session; `watching` notes what that session does; `world` is what acts and notes share; `system` stands
in place of the operating system; `records` hold what is drawn and what happens. `judges` read the records alone.
"""
