; The second program watches what the first one does.
PRG 0
HSPD = 30000
LSPD = 300
ACC = 500
EO = 1
JOGX+
WHILE PX < 500000
ENDWHILE
STOPX
WAITX
X0
WAITX
END

PRG 1
WHILE 1=1
    V10 = MSTX & 7
    IF V10 != 0
        DO2 = 1
    ELSE
        DO2 = 0
    ENDIF
    DELAY = 50
ENDWHILE
END
