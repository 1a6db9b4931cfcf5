//! The list of scenes, for people and for programs.

use super::{report::Report, report::print};
use crate::error::Result;
use crate::synth::registry::{CARRIERS, Parameter, SCENES};
use crate::synth::targets;
use serde_json::{Value, json};

/// Prints every scene and carrier with its parameters.
pub fn show(as_json: bool) -> Result<Report> {
    let scenes: Vec<Value> = SCENES
        .iter()
        .map(|kind| {
            json!({"name": kind.name, "summary": kind.summary, "takes_carrier": kind.takes_carrier(),
                "parameters": parameters(kind.parameters)})
        })
        .collect();
    let carriers: Vec<Value> = CARRIERS
        .iter()
        .map(|kind| json!({"name": kind.name, "summary": kind.summary, "parameters": parameters(kind.parameters)}))
        .collect();
    let with_targets: Vec<Value> = targets::SCENES
        .iter()
        .map(|kind| json!({"name": kind.name, "summary": kind.summary, "frames": kind.frames}))
        .collect();
    if !as_json {
        print(&text())?;
    }
    Ok(Report {
        summary: json!({"command": "synth", "scenes": scenes, "carriers": carriers, "target_scenes": with_targets}),
        failure: None,
    })
}

fn parameters(list: &[Parameter]) -> Vec<Value> {
    list.iter().map(|p| json!({"name": p.name, "default": p.default, "meaning": p.meaning})).collect()
}

fn text() -> String {
    let mut text = String::from("Scenes\n");
    for kind in SCENES {
        text += &entry(kind.name, kind.summary);
        text += &rows(kind.parameters);
    }
    text += "\nCarriers (--carrier), for every scene but those with a picture of their own\n";
    for kind in CARRIERS {
        text += &entry(kind.name, kind.summary);
        text += &rows(kind.parameters);
    }
    text += "\nScenes of targets, in colour, with true boxes (--boxes, --scale)\n";
    for kind in targets::SCENES {
        text += &format!("  {:<18}{}; {} frames\n", kind.name, kind.summary, kind.frames);
    }
    text
}

fn entry(name: &str, summary: &str) -> String {
    format!("  {name:<12}{summary}\n")
}

fn rows(parameters: &[Parameter]) -> String {
    let row = |p: &Parameter| {
        let default = p.default.map_or_else(|| "-".to_string(), |value| format!("{value:.6}"));
        let short = default.trim_end_matches('0').trim_end_matches('.');
        format!("      {:<18}{:>10}  {}\n", p.name, if short.is_empty() { "0" } else { short }, p.meaning)
    };
    parameters.iter().map(row).collect()
}
