' for LMDCM
' Does things during the move, and turns back when a sensor says so.
OS=1,16,1
PG 1
LB Ga
  P=0
  MA 1000000
LB Gw                ' during the move
  O1=1
  H 20
  O1=0
  H 20
  BR Gs,I1=1
  BR Gw,MV=1
  PR "there"
  E
LB Gs
  SL 0
  H
  PR "seen at ",P
  MA 0
  O1=0
LB Gv
  BR Gv,MP=1
  PR "home"
  E
PG
