PG 1
LB SU
 MA 8000
 H
 PR "at ",P
 H 200
 MA 0
 H
 PR "at ",P
E
PG
