; Two axes: above the part, down, grip, up, over to the box.
HSPD=20000
LSPD=500
ACC=200
EO=3
HOMEX-
WAITX
HOMEY-
WAITY
WHILE 1=1
    WHILE DI1=0          ; no part
    ENDWHILE
    X12000Y0
    WAITX
    Y4000
    WAITY
    DO1=1                ; grip
    DELAY=200
    Y0
    WAITY
    X0
    WAITX
    DO1=0
    DELAY=200
ENDWHILE
END
