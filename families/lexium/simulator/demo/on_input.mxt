' Waits for input 1 to be active (/sim input b 1 0) and makes ten turns out and back as long as it is.
' Run it with EX Ga.

' [VARIABLES]
IS=1,0,0
VI=1000
VM=768000
A=1000000
D=A

' [PROGRAMS]
PG 1
LB Ga
  P=0
LB G1
  CL Kb,I1=1
  H 10
  BR G1
E
LB Kb
  MA 512000
  H
  MA 0
  H
  RT
PG
S
' [END]
