def test_heads_in_ranges_are_those_of_the_fluid_of_the_case():
    from dbvfiv.studies.case import load_case

    case = load_case(
        None, ("fluid.density=1025", "onset.over=pressure=0.1 m:4 ft:8:log", "sweep.over=pressure=1 m:2 m:3")
    )
    weight = 1025 * 9.80665
    assert case.onset.axis.log and case.onset.axis.values[::7] == pytest.approx([0.1 * weight, 4 * 0.3048 * weight])
    assert case.sweep.axis.values == pytest.approx([weight, 1.5 * weight, 2 * weight])
