"""How fine must a finite-element mesh be, and where, for the reaction force of a surgical tool?"""

__version__ = "0.1.0"
