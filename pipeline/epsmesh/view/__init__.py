"""One case to look at: its mesh and its displacement, as pictures and as files for ParaView."""
