' for MDI
' NE=1: a number alone repeats the kind of the last move.
NE=1
VM=200000
PG 1
LB N1
  MR 5000
  H
  -2500
  H
  -2500
  H
  PR P
  PR IN
E
PG
S
