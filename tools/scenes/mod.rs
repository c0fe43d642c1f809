//! Makes scene files for the outside scenes, from their JSON descriptions or from the hand-written files in this folder.
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

mod description;
mod emit;
mod mitsuba;
mod rigid;

/// The source of a scene file.
enum Source {
    /// A JSON description below the data's `scenes` folder.
    Json(&'static str),
    /// The JSON description of one of Mitsuba's tests, which is adjusted to give the picture that Mitsuba makes.
    MitsubaTest(&'static str),
    /// A scene file whose paths are relative to the data's `scenes` folder.
    Written(&'static str),
    /// A scene file like those, for frame 00 of a sequence of OBJ files.
    Sequence(&'static str),
    /// The JSON description of the rigid animation.
    Rigid(&'static str),
}

/// All scenes by name, which is also the name of the scene file.
const SCENES: &[(&str, Source)] = &[
    ("cornell-box-rgb", Source::Json("cornell-box/cornell_box.json")),
    ("cornell-box-ignis", Source::Json("cornell-box/cornell_box_ignis.json")),
    ("bitterli-cornell-box", Source::Json("bitterli-cornell-box/scene.json")),
    ("bitterli-veach-mis", Source::Json("bitterli-veach-mis/scene.json")),
    ("nori-table", Source::Json("nori-table/scene.json")),
    ("mitsuba-arealight", Source::MitsubaTest("mitsuba-tests/test_arealight.json")),
    ("mitsuba-constant", Source::MitsubaTest("mitsuba-tests/test_constant.json")),
    ("mitsuba-directional", Source::MitsubaTest("mitsuba-tests/test_directional.json")),
    ("mitsuba-envmap", Source::MitsubaTest("mitsuba-tests/test_envmap.json")),
    ("mitsuba-pointlight", Source::MitsubaTest("mitsuba-tests/test_pointlight.json")),
    ("mitsuba-roughdielectric", Source::MitsubaTest("mitsuba-tests/test_roughdielectric.json")),
    ("mitsuba-textured-diffuse", Source::MitsubaTest("mitsuba-tests/test_textured_diffuse.json")),
    ("ignis-plane", Source::Json("ignis-eval/plane.json")),
    ("ignis-room", Source::Json("ignis-eval/room.json")),
    ("ignis-point", Source::Written(include_str!("ignis-point.toml"))),
    ("bunny-normals", Source::Written(include_str!("bunny-normals.toml"))),
    ("dabrovic-direct", Source::Written(include_str!("dabrovic-direct.toml"))),
    ("dabrovic-sponza", Source::Written(include_str!("dabrovic-sponza.toml"))),
    ("furnace-sphere", Source::Written(include_str!("furnace-sphere.toml"))),
    ("furnace-box", Source::Written(include_str!("furnace-box.toml"))),
    ("crytek-sponza", Source::Written(include_str!("crytek-sponza.toml"))),
    ("bare-sponza", Source::Written(include_str!("bare-sponza.toml"))),
    ("sibenik", Source::Written(include_str!("sibenik.toml"))),
    ("sibenik-lamps", Source::Written(include_str!("sibenik-lamps.toml"))),
    ("forest", Source::Written(include_str!("forest.toml"))),
    ("pine-grove", Source::Written(include_str!("pine-grove.toml"))),
    ("stanford-bunny", Source::Written(include_str!("stanford-bunny.toml"))),
    ("stanford-buddha", Source::Written(include_str!("stanford-buddha.toml"))),
    ("stanford-dragon", Source::Written(include_str!("stanford-dragon.toml"))),
    ("glass-dragon", Source::Written(include_str!("glass-dragon.toml"))),
    ("cornell-bunny", Source::Written(include_str!("cornell-bunny.toml"))),
    ("cornell-buddha", Source::Written(include_str!("cornell-buddha.toml"))),
    ("nefertiti", Source::Written(include_str!("nefertiti.toml"))),
    ("fox", Source::Sequence(include_str!("fox.toml"))),
    ("running-fox", Source::Written(include_str!("running-fox.toml"))),
    ("rigid", Source::Rigid("animation/rigid/rigid_animation.json")),
];

/// Number of frames of the fox, each of which is an OBJ file.
const FOX_FRAMES: usize = 16;

/// The names of all scenes. `fox` and `rigid` can be followed by a frame (`rigid-59`, of 60); the names include frames that
/// have OBJ files of their own.
pub fn names() -> impl Iterator<Item = String> {
    let frames = (1..FOX_FRAMES).map(|frame| format!("fox-{frame:02}"));
    SCENES.iter().map(|(name, _)| (*name).to_owned()).chain(frames)
}

/// Finds the scene that a name means, and its frame.
fn find(name: &str) -> Option<(&'static str, &'static Source, usize)> {
    let known = |name: &str| SCENES.iter().find(|(known, _)| *known == name);
    if let Some((name, source)) = known(name) {
        return Some((name, source, 0));
    }
    let (base, frame) = name.rsplit_once('-')?;
    let (base, source) = known(base).filter(|(_, s)| matches!(s, Source::Sequence(_) | Source::Rigid(_)))?;
    Some((base, source, frame.parse().ok()?))
}

/// Writes `out/NAME.toml`, which names files by absolute paths, and returns its path. `data` is the folder that
/// TALLOW_DATA names.
///
/// # Errors
/// On an unknown name, a missing or malformed file, and anything in the description that a scene file cannot express.
pub fn convert(name: &str, data: &Path, out: &Path) -> anyhow::Result<PathBuf> {
    let Some((base, source, frame)) = find(name) else {
        bail!("there is no scene `{name}`; the names are: {}", names().collect::<Vec<_>>().join(", "));
    };
    let folder = data.join("scenes");
    let folder = folder.canonicalize().with_context(|| format!("{}: set TALLOW_DATA", folder.display()))?;
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let (table, origin) = match source {
        Source::Json(json) | Source::MitsubaTest(json) => {
            let is_mitsuba = matches!(source, Source::MitsubaTest(_));
            (emit::scene(name, &folder.join(json), out, is_mitsuba)?, format!("scenes/{json}"))
        }
        Source::Written(text) => (written(text, &folder)?, format!("tools/scenes/{name}.toml")),
        Source::Sequence(text) => {
            let text = text.replace("_00.obj", &format!("_{frame:02}.obj"));
            (written(&text, &folder)?, format!("tools/scenes/{base}.toml"))
        }
        Source::Rigid(json) => (rigid::scene(&folder, json, frame)?, format!("frame {frame} of scenes/{json}")),
    };
    let path = out.join(format!("{name}.toml"));
    let text = format!("# Made by tools/convert.rs from {origin}; do not edit.\n\n{}", toml::to_string(&table)?);
    std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// Reads a hand-written scene file and makes every path absolute.
fn written(text: &str, folder: &Path) -> anyhow::Result<Table> {
    let mut scene: Table = text.parse()?;
    let tables = scene.iter_mut().flat_map(|(_, value)| match value {
        Value::Array(items) => items.iter_mut().filter_map(Value::as_table_mut).collect(),
        Value::Table(table) => vec![table],
        _ => vec![],
    });
    for table in tables {
        if let Some(Value::String(file)) = table.get_mut("file") {
            let path = folder.join(&*file);
            anyhow::ensure!(path.is_file(), "{} is missing", path.display());
            *file = path.display().to_string();
        }
    }
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn objs(folder: &Path) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
        let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
        let below = folders.iter().flat_map(|folder| objs(folder));
        files.into_iter().filter(|path| path.extension().is_some_and(|e| e == "obj")).chain(below).collect()
    }

    /// Whether a converted description lies beside a model: it says the same in shapes of its own.
    fn is_described(obj: &Path, folder: &Path) -> bool {
        let beside = |json: &str| folder.join(json) == obj.with_extension("json");
        SCENES.iter().any(|(_, source)| matches!(source, Source::Json(json) if beside(json)))
    }

    #[test]
    #[ignore = "needs TALLOW_DATA"]
    fn every_obj_is_in_a_scene() {
        let (out, data) = (tempfile::tempdir().unwrap(), std::env::var_os("TALLOW_DATA").expect("TALLOW_DATA"));
        let text = |name: String| std::fs::read_to_string(convert(&name, Path::new(&data), out.path()).unwrap());
        let scenes: String = names().map(|name| text(name).unwrap()).collect();
        let folder = Path::new(&data).join("scenes").canonicalize().unwrap();
        let found = objs(&folder);
        assert!(found.len() >= 50, "only {} OBJ files below {}", found.len(), folder.display());
        let is_in = |obj: &&PathBuf| scenes.contains(&format!("/{}\"", obj.strip_prefix(&folder).unwrap().display()));
        let missing: Vec<_> = found.iter().filter(|obj| !is_in(obj) && !is_described(obj, &folder)).collect();
        assert!(missing.is_empty(), "{missing:?}");
    }

    #[test]
    fn what_moves_takes_a_frame() {
        let frame = |name| find(name).map(|(base, _, frame)| (base, frame));
        assert_eq!(
            (frame("fox"), frame("fox-03"), frame("rigid-59")),
            (Some(("fox", 0)), Some(("fox", 3)), Some(("rigid", 59)))
        );
        assert_eq!((frame("forest-1"), frame("fox-"), frame("wolf-1")), (None, None, None));
        assert!(names().all(|name| find(&name).is_some()));
    }
}
