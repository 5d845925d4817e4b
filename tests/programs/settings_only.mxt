' for LMDOM
' The settings of a machine, without a program.
VM=450000
VI=1500
A=800000
D=800000
RC=70
HC=15
HT=300
IS=1,0,0
OS=1,16,1
VA Q1=5
Q1=6
S
