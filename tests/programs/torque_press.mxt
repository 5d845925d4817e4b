' for LMDCM
' Presses with a set torque for two seconds, then goes back.
VA Tv=30
AS=0
TS=100000
TD=1
PG 1
LB Px
  MA 40000
  H
  TQ=Tv
  AS=3
  H 2000
  SL 0
  H
  AS=0
  H 100
  MA 0
  H
  PR "pressed, ",P
E
PG
