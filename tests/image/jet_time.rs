//! Time differences of jets: the two schemes.

use jacoflow::jet::TimeScheme;

#[test]
fn both_schemes_differentiate_a_parabola_in_time() {
    // 3 + 2 t + 5 t^2 at t = -1, 0, 1.
    let (old, middle, new) = ([6.0; 6], [3.0; 6], [10.0; 6]);
    let central = TimeScheme::Central.rates(old, middle, new);
    assert_eq!((central.jet[0], central.first[1], central.second[2]), (3.0, 2.0, 10.0));
    let backward = TimeScheme::Backward.rates(old, middle, new);
    assert_eq!((backward.jet[0], backward.first[1], backward.second[2]), (10.0, 7.0, 10.0));
    for scheme in [TimeScheme::Central, TimeScheme::Backward] {
        let w = scheme.first_weights();
        assert_eq!(w[0] * 6.0 + w[1] * 3.0 + w[2] * 10.0, scheme.rates(old, middle, new).first[0]);
        assert_eq!(TimeScheme::parse(scheme.name()).unwrap(), scheme);
    }
    assert!(TimeScheme::parse("forward").unwrap_err().to_string().contains("scheme"));
}
