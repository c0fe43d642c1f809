//! Who may import whom, and where Vulkan and `unsafe` may be written: data flows one way.
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A module of the crate, and the modules it may name.
const MAY_IMPORT: &[(&str, &[&str])] = &[
    ("main", &[]),
    ("lib", &[]),
    (
        "cli",
        &[
            "allocate",
            "denoise",
            "error",
            "gpu",
            "image",
            "layout",
            "memory",
            "render",
            "report",
            "scene",
            "settings",
            "statistics",
        ],
    ),
    ("denoise", &["error", "gpu", "image", "layout", "render", "settings", "shaders", "twins"]),
    ("render", &["allocate", "error", "gpu", "layout", "scene", "settings", "shaders", "statistics", "twins"]),
    ("allocate", &["error", "gpu", "layout", "settings", "shaders", "statistics", "twins"]),
    ("scene", &["error", "image", "layout", "memory", "render::settings", "threads", "twins"]),
    ("twins", &["layout", "render::schedule", "render::settings", "scene", "shaders", "statistics"]),
    ("image", &["error", "layout", "memory"]),
    ("memory", &["error"]),
    ("settings", &["error"]),
    ("threads", &[]),
    ("report", &["error", "gpu"]),
    ("guide", &[]),
    ("statistics", &["layout"]),
    ("error", &[]),
    ("layout", &[]),
    ("gpu", &["error", "shaders"]),
];

/// Words that only one module may hold: those of Vulkan, and of what an engine does without (the feature `cli`).
const ROOMS: &[(&str, &[&str])] =
    &[("gpu", &["unsafe", "vk::", "ash::"]), ("cli", &["clap::", "signal_hook::", "indicatif::"])];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|p| p.is_dir());
    let below = folders.iter().flat_map(|f| sources(f));
    files.into_iter().filter(|f| f.extension().is_some_and(|e| e == "rs")).chain(below).collect()
}

/// The lines of a file without comments, strings and what only the feature `cli` switches on.
fn code(text: &str) -> String {
    let bare = |line: &str| {
        let line = line.split("//").next().unwrap_or_default();
        line.split('"').step_by(2).collect::<String>()
    };
    text.lines()
        .filter(|line| !line.trim_start().starts_with("#[cfg_attr(feature = \"cli\","))
        .map(bare)
        .collect::<Vec<_>>()
        .join("\n")
}

/// Paths below the crate's root that a file names: `gpu::layout`, `error`.
fn named(code: &str) -> BTreeSet<String> {
    let path = |rest: &str| {
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_' && c != ':').unwrap_or(rest.len());
        rest[..end].split("::").filter(|p| !p.is_empty()).take(2).collect::<Vec<_>>().join("::")
    };
    code.split("crate::").skip(1).map(path).collect()
}

/// What a file of `module` does that it must not.
fn faults(module: &str, text: &str) -> Vec<String> {
    let code = code(text);
    let Some((_, allowed)) = MAY_IMPORT.iter().find(|(name, _)| *name == module) else {
        return vec![format!("{module} is a new module: say what it may import")];
    };
    let within = |path: &str, root: &str| path == root || path.starts_with(&format!("{root}::"));
    let fine = |path: &str| within(path, module) || allowed.iter().any(|root| within(path, root));
    let mut found: Vec<_> =
        named(&code).into_iter().filter(|p| !fine(p)).map(|p| format!("names crate::{p}")).collect();
    let starts = |at: usize| !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let elsewhere = ROOMS.iter().filter(|(room, _)| *room != module).flat_map(|(_, words)| *words);
    let words = elsewhere.filter(|w| code.match_indices(*w).any(|(at, _)| starts(at)));
    found.extend(words.map(|w| format!("writes {w}")));
    found
}

#[test]
fn data_flows_one_way_and_vulkan_stays_in_its_room() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = Vec::new();
    for file in sources(&root) {
        let inside = file.strip_prefix(&root).unwrap();
        let module = inside.iter().next().unwrap().to_string_lossy().trim_end_matches(".rs").to_owned();
        let text = std::fs::read_to_string(&file).unwrap();
        all.extend(faults(&module, &text).into_iter().map(|what| format!("{}: {what}", inside.display())));
    }
    assert!(sources(&root).len() > 80, "the sources were not found");
    assert!(all.is_empty(), "{all:#?}");
}

#[test]
fn a_fault_is_found() {
    assert_eq!(faults("scene", "use crate::gpu::Gpu;"), ["names crate::gpu::Gpu"]);
    assert_eq!(faults("image", "let x = unsafe { 1 };"), ["writes unsafe"]);
    assert_eq!(
        faults("allocate", "fn f(b: vk::Buffer) {}\nuse crate::cli::Exit;"),
        ["names crate::cli::Exit", "writes vk::"]
    );
    assert_eq!(faults("render", "#[derive(clap::ValueEnum)]"), ["writes clap::"]);
    let switched = "#[cfg_attr(feature = \"cli\", derive(clap::ValueEnum))]";
    assert_eq!(faults("render", switched), [] as [&str; 0]);
    assert_eq!(faults("allocate", "use hash::Hash;"), [] as [&str; 0], "ash:: within a word");
    assert_eq!(faults("scene", "// crate::cli and unsafe\nuse crate::layout::Light;"), [] as [&str; 0]);
    assert_eq!(faults("drawer", "").len(), 1);
}
