//! Switches heuristics off, one at a time, so that a table can show what each of them buys.
//!
//! A heuristic is a rule that the specification's equations do not contain: a repair of a start, an
//! exception, a second search, a gate, a filler of gaps. Each has a line in [`HEURISTICS`] and one call of
//! [`keeps`] where it acts. Without the feature `ablation` every call is the constant `true`; with it the
//! environment variable `JACOFLOW_WITHOUT` lists the names that are off. `benchmarks/ablation.py` prints the
//! table.

/// The heuristics of all systems: name (`system.rule`) and what the rule is for.
pub const HEURISTICS: &[(&str, &str)] = &[];

/// Whether the heuristic `name` acts.
#[cfg(not(feature = "ablation"))]
#[inline(always)]
pub const fn keeps(_name: &str) -> bool {
    true
}

/// Whether the heuristic `name` acts: not if `JACOFLOW_WITHOUT` lists it.
///
/// # Panics
///
/// If `name` or a listed name is not in [`HEURISTICS`].
#[cfg(feature = "ablation")]
pub fn keeps(name: &str) -> bool {
    static WITHOUT: std::sync::OnceLock<Vec<String>> = std::sync::OnceLock::new();
    let is_known = |name: &str| HEURISTICS.iter().any(|(known, _)| *known == name);
    let without = WITHOUT.get_or_init(|| {
        let listed = std::env::var("JACOFLOW_WITHOUT").unwrap_or_default();
        let names: Vec<String> = listed.split(',').filter(|name| !name.is_empty()).map(String::from).collect();
        for name in &names {
            assert!(is_known(name), "JACOFLOW_WITHOUT: expected names of HEURISTICS, got {name}");
        }
        names
    });
    debug_assert!(is_known(name), "{name}: a heuristic without a line in HEURISTICS");
    !without.iter().any(|off| off == name)
}
