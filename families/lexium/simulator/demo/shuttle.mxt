' Goes out ten turns and comes back until it is stopped.
' Run it with EX Ga, end it with ESC.

' [VARIABLES]
VI=1000
VM=768000
A=1000000
D=A

' [PROGRAMS]
PG 1
LB Ga
  P=0
LB G1
  MA 512000
  H
  H 250
  MA 0
  H
  H 250
  BR G1
E
PG
S
' [END]
