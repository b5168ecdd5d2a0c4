"""Systems of the literature, each made once, so that what is compiled for one test serves the others."""

from functools import cache

from tests.systems import brusselator as _brusselator
from tests.systems import literature, normal_forms
from tests.systems import lorenz as _lorenz
from tests.systems import van_der_pol as _van_der_pol

brusselator, brusselator_1d = cache(_brusselator.brusselator), cache(_brusselator.brusselator_1d)
bautin, bogdanov_takens, cusp = map(cache, (normal_forms.bautin, normal_forms.bogdanov_takens, normal_forms.cusp))
pitchfork, transcritical = cache(normal_forms.pitchfork), cache(normal_forms.transcritical)
stuart_landau, warped_stuart_landau = cache(normal_forms.stuart_landau), cache(normal_forms.warped_stuart_landau)
fitzhugh_nagumo, lorenz = cache(literature.fitzhugh_nagumo), cache(_lorenz.lorenz)
van_der_pol = cache(_van_der_pol.van_der_pol)
