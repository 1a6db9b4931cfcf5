//! The table of methods and their options.

use jacoflow::flow::{METHODS, Method, MethodSettings};
use jacoflow::jet::Neighbourhood;

#[test]
fn every_method_has_its_own_line_and_is_built_by_name() {
    for info in METHODS {
        let method = Method::parse(info.name).unwrap();
        assert_eq!((method.name(), method.info().name), (info.name, info.name));
    }
    let unknown = Method::parse("magic").unwrap_err().to_string();
    assert!(unknown.starts_with("method: expected coarse_to_fine, windowed,") && unknown.ends_with("got magic"));
}

#[test]
fn options_of_the_table_are_those_of_the_settings() {
    let known = MethodSettings::default().given().map(|(name, _)| name);
    for info in METHODS {
        assert!(info.options.iter().all(|name| *name == "model" || known.contains(name)), "{}", info.name);
        assert_eq!(info.options.contains(&"model"), info.models.len() > 1);
        assert_eq!(info.options.contains(&"preset"), !info.presets.is_empty());
    }
    for name in known {
        assert!(METHODS.iter().any(|info| info.options.contains(&name)), "{name}");
    }
}

#[test]
fn every_time_scheme_of_the_table_is_understood() {
    for info in METHODS {
        for name in info.time_schemes {
            let scheme = Some((*name).to_string());
            MethodSettings { method: info.name.into(), time_scheme: scheme, ..Default::default() }.method().unwrap();
        }
    }
}

#[test]
fn what_a_method_does_not_take_is_refused_with_the_methods_that_do() {
    let settings = MethodSettings { method: "horn_schunck".into(), ..Default::default() };
    let message = |settings: MethodSettings| settings.method().unwrap_err().to_string();
    assert_eq!(
        message(MethodSettings { window_sigma: Some(3.0), ..settings.clone() }),
        "window_sigma: expected method windowed or lucas_kanade, got horn_schunck"
    );
    assert_eq!(
        message(MethodSettings { time_scheme: Some("forward".into()), ..settings.clone() }),
        "time_scheme: expected central or pair for method horn_schunck, got forward"
    );
    assert_eq!(
        message(MethodSettings { model: Some("affine".into()), ..settings }),
        "model: expected translational for method horn_schunck, got affine"
    );
}

#[test]
fn weights_of_a_neighbourhood_apply_to_the_default_pixels_too() {
    let settings =
        MethodSettings { method: "instantaneous".into(), neighbourhood_sigma: Some(1.5), ..Default::default() };
    let Method::Instantaneous(options) = settings.method().unwrap() else { unreachable!() };
    assert_eq!(options.neighbourhood, Neighbourhood::Rectangle { width: 3, height: 3, sigma: Some(1.5) });
}
