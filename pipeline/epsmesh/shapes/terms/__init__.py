"""Terms of the energy of a body, one file each, named like its tables in a study: ``[[load.NAME]]``."""
