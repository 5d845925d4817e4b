"""Programs of the eight shapes that the controller's manual shows in 10.2, and one with everything."""

THERE_AND_BACK = """
HSPD=20000 ; pulses/s
LSPD=1000
ACC=300
EO=1
X1000
WAITX
X0
WAITX
END
"""
FOREVER = """
HSPD=20000
LSPD=1000
ACC=20
EO=1
WHILE 1=1
    X0
    WAITX
    X1000
    WAITX
ENDWHILE
END
"""
TEN_TIMES = """
HSPD=20000
LSPD=1000
ACC=20
EO=1
V1=0
WHILE V1<10
    X0
    WAITX
    X1000
    WAITX
    V1=V1+1
ENDWHILE
END
"""
ON_INPUT = """
HSPD=20000
LSPD=1000
ACC=20
EO=1
WHILE 1=1
    IF DI1=1
        X0
        WAITX
        X1000
        WAITX
    ENDIF
ENDWHILE
END
"""
STEP_PER_EDGE = """
HSPD=20000
LSPD=1000
ACC=20
EO=1
V1=0
WHILE 1=1
    IF DI1=1
        GOSUB 1
    ENDIF
ENDWHILE
END

SUB 1
    XV1
    WAITX
    V1=V1+1000
    WHILE DI1=1
    ENDWHILE
ENDSUB
"""
CHOOSER = """
HSPD=20000
LSPD=1000
ACC=20
EO=1
WHILE 1=1
    IF DI1=1
        X1000
        WAITX
    ELSEIF DI2=1
        X2000
        WAITX
    ELSEIF DI3=1
        X3000
        WAITX
    ELSEIF DI5=1
        HOMEX-
        WAITX
    ENDIF
    V1=MSTX
    V2=V1&7
    IF V2!=0
        DO1=1
    ELSE
        DO1=0
    ENDIF
ENDWHILE
END
"""
TWO = """
PRG 0
HSPD=20000
LSPD=500
ACC=50
WHILE 1=1
    X0
    WAITX
    X1000
    WAITX
ENDWHILE
END

PRG 1
WHILE 1=1
    IF DI1=1
        ABORTX
        SR0=0
    ELSE
        SR0=1
    ENDIF
ENDWHILE
END
"""
WATCHDOG = """
PRG 0
HSPD=1000
LSPD=500
ACC=50
TOC=5000
EO=1
WHILE 1=1
    X0
    WAITX
    X1000
    WAITX
ENDWHILE
END

PRG 1
WHILE 1=1
    V1=MSTX&2048
    IF V1 = 2048
        SR0=0
        ABORTX
        DO=0
        DELAY=3000
        SR0=1
        DO=1
    ENDIF
ENDWHILE
END
"""
EVERYTHING = """
SUB 31
    ECLEARX
    ECLEARY
ENDSUB

SUB 0
    V63=~DO
    V62=-5
    V61=V62/V63
    V60=V1%7
    V59=V1>>2
    V58=V1<<3
    V57=V1|8
    V56=V1-V2
    V55=V1*-3
ENDSUB

HSPD=V1
LSPDY=20
IF V1>=2
    IF V2<=3
    ELSE
        IF V3>1
            DO=1
        ENDIF
    ENDIF
ELSEIF 1=2
ELSE
    WHILE AI1<2500
        WHILE V1!=V2
            GOSUB 0
        ENDWHILE
    ENDWHILE
ENDIF
X100Y-200
YV3
X-5YV0
INC
ABS
JOGX+
SSPDMX=1
SSPDX=4000
STOPX
HLHOMEY-
WAITY
JOYENA=3
JOYHSX=1000
JOYNOY=-100
DELAY=V4
STORE
END
"""
EXAMPLES = (THERE_AND_BACK, FOREVER, TEN_TIMES, ON_INPUT, STEP_PER_EDGE, CHOOSER, TWO, WATCHDOG)


def plain(text: str) -> list[str]:
    """A program without remarks, blanks and indents."""
    lines = [line.partition(";")[0].replace(" = ", "=").strip() for line in text.splitlines()]
    return [line for line in lines if line]
