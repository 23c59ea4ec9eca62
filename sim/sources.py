"""The bibliography: every source that a number or an equation is taken from, written once."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """A citation and the place in it.

    Parameters
    ----------
    key : str
        Short key, unique.
    citation : str
        Authors, title, year, identifier.
    """

    key: str
    citation: str

    def at(self, place: str) -> Source:
        """The same source, with the place in it (equation, table)."""
        return Source(self.key, f"{self.citation}, {place}")


THESIS = Source(
    "thesis",
    "Master's thesis 'Experimental Testing and Dynamic Modelling of a Planetary Magnetic Gearbox "
    "Prototype', Politecnico di Torino",
)
GUM = Source(
    "gum",
    "JCGM 100:2008, Evaluation of measurement data: guide to the expression of uncertainty in measurement",
)
BERTOTTI = Source(
    "bertotti",
    "G. Bertotti, 'General properties of power losses in soft ferromagnetic materials', "
    "IEEE Transactions on Magnetics 24(1), 1988, doi:10.1109/20.43994",
)
BURNHAM_ANDERSON = Source(
    "burnham-anderson",
    "K. P. Burnham, D. R. Anderson, 'Model Selection and Multimodel Inference', 2nd ed., Springer, 2002",
)
FLEGAL_JONES = Source(
    "flegal-jones",
    "J. M. Flegal, G. L. Jones, 'Batch means and spectral variance estimators in Markov chain Monte Carlo', "
    "Annals of Statistics 38(2), 2010, doi:10.1214/09-AOS735",
)
PERCIVAL_WALDEN = Source(
    "percival-walden",
    "D. B. Percival, A. T. Walden, 'Spectral Analysis for Physical Applications', Cambridge University Press, 1993",
)
FYFE_MUNCK = Source(
    "fyfe-munck",
    "K. R. Fyfe, E. D. S. Munck, 'Analysis of computed order tracking', Mechanical Systems and Signal Processing "
    "11(2), 1997, doi:10.1006/mssp.1996.0056",
)
WESTFALL_YOUNG = Source(
    "westfall-young", "P. H. Westfall, S. S. Young, 'Resampling-Based Multiple Testing', Wiley, 1993"
)
PALMGREN = Source(
    "palmgren", "A. Palmgren, 'Ball and Roller Bearing Engineering', 3rd ed., S. H. Burbank, Philadelphia, 1959"
)
HARRIS = Source(
    "harris",
    "T. A. Harris, M. N. Kotzalas, 'Essential Concepts of Bearing Technology', 5th ed., CRC Press, 2006",
)
SKF = Source("skf", "SKF Group, 'Rolling bearings', catalogue PUB BU/P1 17000 EN, 2018, model of the frictional moment")
SCHLICHTING = Source("schlichting", "H. Schlichting, K. Gersten, 'Boundary-Layer Theory', 9th ed., Springer, 2017")
WOUTERSE = Source(
    "wouterse",
    "J. H. Wouterse, 'Critical torque and speed of eddy current brake with widely separated soft iron poles', "
    "IEE Proceedings B 138(4), 1991, doi:10.1049/ip-b.1991.0019",
)
STOLL = Source("stoll", "R. L. Stoll, 'The Analysis of Eddy Currents', Clarendon Press, Oxford, 1974")
ARMSTRONG = Source(
    "armstrong",
    "B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, 'A survey of models, analysis tools and compensation methods "
    "for the control of machines with friction', Automatica 30(7), 1994, doi:10.1016/0005-1098(94)90209-7",
)
BREIMAN = Source(
    "breiman",
    "L. Breiman, J. H. Friedman, R. A. Olshen, C. J. Stone, 'Classification and Regression Trees', Wadsworth, 1984",
)
HUBER = Source("huber", "P. J. Huber, E. M. Ronchetti, 'Robust Statistics', 2nd ed., Wiley, 2009")
HOLLAND_WELSCH = Source(
    "holland-welsch",
    "P. W. Holland, R. E. Welsch, 'Robust regression using iteratively reweighted least-squares', Communications in "
    "Statistics A6, 1977, doi:10.1080/03610927708827533",
)
DUMOUCHEL = Source(
    "dumouchel",
    "W. DuMouchel, F. O'Brien, 'Integrating a robust option into a multiple regression computing environment', "
    "Proceedings of the 21st Symposium on the Interface, 1989",
)
HOLM = Source(
    "holm",
    "S. Holm, 'A simple sequentially rejective multiple test procedure', Scandinavian Journal of Statistics 6(2), 1979",
)
BIRGE = Source(
    "birge",
    "R. T. Birge, 'The calculation of errors by the method of least squares', Physical Review 40, 1932, "
    "doi:10.1103/PhysRev.40.207",
)
DAHL = Source("dahl", "P. R. Dahl, 'A solid friction model', Aerospace Corporation, TOR-0158(3107-18)-1, 1968")
ANDERSSON = Source(
    "andersson-friction",
    "S. Andersson, A. Söderberg, S. Björklund, 'Friction models for sliding dry, boundary and mixed lubricated "
    "contacts', Tribology International 40, 580-587, 2007",
)
BALANCE = Source("force-balance", "Force balance of a moving part; a term written down for this library")
