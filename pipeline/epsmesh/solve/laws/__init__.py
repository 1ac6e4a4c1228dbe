"""Material laws, one file each: ``LAWS`` has them by the names of the study file. ``law`` says what a law is."""

from epsmesh.solve.laws import gent, holzapfel, linear, mooney_rivlin, neo_hookean, ogden, veronda_westmann, yeoh
from epsmesh.solve.laws.law import Law

LAWS: dict[str, Law] = {
    "linear": linear.LAW,
    "neo-hookean": neo_hookean.LAW,
    "mooney-rivlin": mooney_rivlin.LAW,
    "yeoh": yeoh.LAW,
    "ogden": ogden.LAW,
    "gent": gent.LAW,
    "holzapfel": holzapfel.LAW,
    "veronda-westmann": veronda_westmann.LAW,
}
