' for LMDCM
' A servant of its host: each label is started with EX. Nothing here starts by itself.
VA X1=0
VA X2=0
PG 1
LB A0          ' forward
  MR X1
  H
  PR "ok"
  E
LB A1          ' absolute
  MA X2,1      ' sends its name when it is there
  E
LB A2          ' stop with a ramp
  SL 0
  H
  PR P
  E
LB A3          ' turn
  SL X1
  E
LB A4          ' home, then offset
  HM 3
  H
  MR X2
  H
  P=0
  PR "home"
  E
LB A5          ' a move that the host may replace: no wait
  MA X1
  E
PG
S
