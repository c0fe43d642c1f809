//! Makes movers of the `[[animation]]` tables.
use super::curve::Curve;
use super::frames::Frames;
use super::keyed::{Keyed, Target};
use super::{Animation, Mover};
use crate::error::{Checked, Error, Result};
use crate::scene::Scene;
use crate::scene::apply::check_numbers;
use crate::scene::description::{
    self, AnimationTable, Camera, Description, Interpolation, mesh_number, meshes_to_free, numbered, rotation,
};
use crate::scene::description::{Key, Transform, affine};
use crate::scene::pose::Pose;
use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// The description whose meshes are stored apart where an animation moves them.
pub fn with_freed_meshes(description: &Description) -> Cow<'_, Description> {
    let mut freed = Cow::Borrowed(description);
    for (number, file) in meshes_to_free(description) {
        let mesh = &mut freed.to_mut().mesh[number];
        mesh.moving = true;
        mesh.file = file.or(mesh.file.take());
    }
    freed
}

/// The movers of a scene file's tables, after those that its loader has, and warnings about what their keys say.
///
/// # Errors
/// [`Error::Input`] with the table at fault, and the key whose numbers are out of range.
pub fn load(
    path: &Path,
    description: &Description,
    movers: &[Arc<dyn Mover>],
    scene: &Scene,
) -> Result<(Animation, Vec<String>)> {
    let mut warnings = Vec::new();
    let mut animation = Animation { movers: movers.to_vec() };
    let mut moved = HashSet::new();
    for (number, table) in (1..).zip(&description.animation) {
        let place = format!("animation {number}");
        let at = |what: String| Error::input_at(path, &place, what);
        let (what, mover) = mover(path, table, description, scene).map_err(at)?;
        if !moved.insert(what.clone()) {
            return Err(at(format!("{what} is moved by an earlier table: put all keys into one")));
        }
        for (key_number, key) in (1..).zip(&table.keys) {
            let said = format!("key {key_number}, at {}", key.time);
            let mut pose = Pose::default();
            mover.iter().try_for_each(|mover| mover.pose(key.time, &mut pose))?;
            let clamped = check_numbers(scene, &pose).map_err(|what| at(format!("{said}: {what}")))?;
            warnings.extend(clamped.iter().map(|what| format!("{place}, {said}: {what}")));
        }
        animation.movers.extend(mover);
    }
    Ok((animation, warnings))
}

/// The keys of a table that moves a node of a glTF file.
///
/// # Errors
/// A sentence about keys that it cannot have.
pub fn of_node(table: &AnimationTable) -> Checked<Keyed> {
    Ok(Keyed { curves: curves(table, &Target::Node)?, target: Target::Node })
}

/// What a table moves, and its mover; a node's file has its keys.
type Moving = (String, Option<Arc<dyn Mover>>);

fn mover(path: &Path, table: &AnimationTable, from: &Description, scene: &Scene) -> Checked<Moving> {
    let targets = [&table.instance, &table.node, &table.light, &table.material, &table.mesh].map(Option::is_some);
    let count = targets.into_iter().chain([table.camera, table.environment]).filter(|on| *on).count();
    if count != 1 {
        return Err("needs one of camera, instance, node, light, material, environment and mesh".to_owned());
    }
    if let Some(name) = &table.mesh {
        let number = scene.rig.mesh(name).ok_or_else(|| unknown("mesh", name, from.mesh.iter().map(|m| &m.name)))?;
        return Ok((format!("mesh \"{name}\""), Some(Arc::new(frames(path, table, from, number)?))));
    }
    if table.file.is_some() {
        return Err("has a file, which is for a mesh".to_owned());
    }
    if let Some(name) = &table.node {
        return Ok((format!("node \"{name}\""), None));
    }
    let (what, target) = target(table, from, scene)?;
    let curves = curves(table, &target)?;
    let stands = ["position", "target", "up"];
    if let Target::Camera(Camera { world_from_camera: Some(_), .. }) = &target
        && curves.iter().any(|(name, _)| stands.contains(name))
    {
        return Err(
            "the camera stands by its world_from_camera: give it position and target instead, to move them".to_owned()
        );
    }
    Ok((what, Some(Arc::new(Keyed { target, curves }))))
}

fn target(table: &AnimationTable, from: &Description, scene: &Scene) -> Checked<(String, Target)> {
    if table.camera {
        return Ok(("the camera".to_owned(), Target::Camera(from.camera.clone())));
    }
    if let Some(name) = &table.instance {
        let number = scene.rig.placement(name).ok_or_else(|| not_placed(name, from))?;
        let rest = match from.instance.get(number) {
            Some(instance) => instance.transform,
            None => mesh_number(from, name).map_or(Transform::default(), |number| from.mesh[number].transform),
        };
        return Ok((format!("instance \"{name}\""), Target::Placement(number, rest)));
    }
    if let Some(name) = &table.light {
        let found = scene.rig.light(name).ok_or_else(|| unknown("light", name, from.light.iter().map(|l| &l.name)))?;
        return Ok((format!("light \"{name}\""), Target::Light(found, from.light[found].clone())));
    }
    if let Some(name) = &table.material {
        let all: Vec<_> = scene.names.materials.iter().map(|name| Some(name.clone())).collect();
        let found = scene.names.material(name).ok_or_else(|| unknown("material", name, all.iter()))?;
        return Ok((format!("material \"{name}\""), Target::Material(found)));
    }
    match from.environment {
        Some(_) => Ok(("the environment".to_owned(), Target::Environment)),
        None => Err("there is no [environment]".to_owned()),
    }
}

fn not_placed(name: &String, from: &Description) -> String {
    if mesh_number(from, name).is_some() {
        return format!(
            "mesh \"{name}\" is placed by instances without a name: a part of a glTF file is moved by `node`"
        );
    }
    unknown("instance", name, from.instance.iter().map(|i| &i.name).chain(from.mesh.iter().map(|m| &m.name)))
}

fn unknown<'a>(kind: &str, name: &str, known: impl Iterator<Item = &'a Option<String>>) -> String {
    match description::nearest(name, known.flatten().map(String::as_str)) {
        Some(near) => format!("no {kind} \"{name}\" that can be moved: did you mean \"{near}\"?"),
        None => format!(
            "no {kind} \"{name}\" that can be moved, since none has a name: write name = \"{name}\" in its table"
        ),
    }
}

fn curves(table: &AnimationTable, target: &Target) -> Checked<Vec<(&'static str, Curve)>> {
    if table.keys.is_empty() {
        return Err("has no keys".to_owned());
    }
    let times: Vec<_> = table.keys.iter().map(|key| (key.time, Vec::new())).collect();
    let end = Curve::new(times, Interpolation::Step, false)?.end();
    for (number, key) in (1..).zip(&table.keys) {
        check(key, target).map_err(|what| format!("key {number}, at {}: {what}", key.time))?;
    }
    let says = |name: &&str| table.keys.iter().any(|key| key.values.contains_key(*name));
    if says(&"transform") && ["translate", "rotate", "scale"].iter().any(says) {
        return Err("has a transform and parts of one: choose".to_owned());
    }
    let mut curves = Vec::new();
    for &(name, counts) in target.channels() {
        let of = |key: &Key| Some((key.time, widened(key.values.get(name)?.list(), counts)));
        let keys: Vec<_> = table.keys.iter().filter_map(of).collect();
        if !keys.is_empty() {
            add(name, keys, table.interpolation, &mut curves)?;
        }
    }
    let repeated = |(name, curve): (_, Curve)| (name, if table.repeat { curve.repeated(end) } else { curve });
    Ok(curves.into_iter().map(repeated).collect())
}

/// One number where three may stand counts for all of them.
fn widened(values: Vec<f64>, counts: &[usize]) -> Vec<f64> {
    if counts == [3, 1] && values.len() == 1 { vec![values[0]; 3] } else { values }
}

/// Rotations become quaternions; and so do those in matrices without shear, which would shrink on the way.
fn add(
    name: &'static str,
    keys: Vec<(f64, Vec<f64>)>,
    interpolation: Interpolation,
    curves: &mut Vec<(&'static str, Curve)>,
) -> Checked {
    if name == "rotate" {
        let turned = |(time, v): &(f64, Vec<f64>)| Ok((*time, rotation(v)?.to_array().to_vec()));
        let keys = keys.iter().map(turned).collect::<Checked<Vec<_>>>()?;
        curves.push((name, Curve::new(keys, interpolation, true)?));
        return Ok(());
    }
    let steps = |rows: &[f64]| {
        let placed = affine(rows)?;
        Transform::from(placed).steps().map(|(scale, rotation)| (scale, rotation, placed.translation))
    };
    let split: Option<Vec<_>> = keys.iter().map(|(_, rows)| steps(rows)).collect();
    match split.filter(|_| name == "transform" && interpolation == Interpolation::Linear) {
        Some(split) => {
            let of = |value: &dyn Fn(usize) -> Vec<f64>| (0..keys.len()).map(|i| (keys[i].0, value(i))).collect();
            let scale = Curve::new(of(&|i| split[i].0.to_array().to_vec()), interpolation, false)?;
            let turn = Curve::new(of(&|i| split[i].1.to_array().to_vec()), interpolation, true)?;
            let shift = Curve::new(of(&|i| split[i].2.to_array().to_vec()), interpolation, false)?;
            curves.extend([("scale", scale), ("rotate", turn), ("translate", shift)]);
        }
        None => curves.push((name, Curve::new(keys, interpolation, false)?)),
    }
    Ok(())
}

/// Checks that a key says what the target has, in as many numbers.
fn check(key: &Key, target: &Target) -> Checked {
    let channels = target.channels();
    for (name, numbers) in &key.values {
        let Some((_, counts)) = channels.iter().find(|(known, _)| known == name) else {
            let known: Vec<_> = channels.iter().map(|(known, _)| *known).collect();
            return Err(format!("unknown key \"{name}\": choose from {}", known.join(", ")));
        };
        let count = numbers.list().len();
        if !counts.contains(&count) {
            return Err(format!("{name} has {count} numbers, not {}", counts[0]));
        }
        if name == "transform" && numbers.list()[12..] != [0.0, 0.0, 0.0, 1.0] {
            return Err("the last row of transform is not 0 0 0 1".to_owned());
        }
    }
    let [turns, scales] = ["rotate", "scale"].map(|name| key.values.contains_key(name));
    let sheared = matches!(target, Target::Placement(_, rest) if rest.steps().is_none());
    match sheared && turns != scales {
        true => Err("its table's transform has shear, which has no rotate or scale to keep: give both".to_owned()),
        false => Ok(()),
    }
}

fn frames(path: &Path, table: &AnimationTable, from: &Description, mesh: usize) -> Checked<Frames> {
    let file =
        table.file.as_ref().ok_or("deforms a mesh, which takes a file of every pose: file = \"pose.####.obj\"")?;
    let beside = |file: &Path| path.parent().unwrap_or(Path::new("")).join(file.to_string_lossy().replace('\\', "/"));
    let pattern = beside(file);
    let fps = table.fps.unwrap_or(24.0);
    if !table.keys.is_empty() {
        return Err("has keys and files: choose".to_owned());
    }
    if !(fps > 0.0 && fps <= 1e6) {
        return Err(format!("fps is {fps}: choose a number above 0, at most 1000000"));
    }
    if table.last < table.first || numbered(&pattern.to_string_lossy(), 0).is_none() {
        let [first, last] = [table.first, table.last];
        return Err(format!(
            "file \"{}\", {first} to {last}: give `#` for the number, and a last that is no less",
            file.display()
        ));
    }
    let count = (table.last - table.first).saturating_add(1);
    let (first, interpolation, repeat) = (table.first, table.interpolation, table.repeat);
    let (table, read) = (from.mesh[mesh].clone(), Mutex::default());
    let first_pose = || PathBuf::from(numbered(&pattern.to_string_lossy(), first).unwrap_or_default());
    let base = table.file.as_ref().map_or_else(first_pose, |file| beside(file));
    Ok(Frames { mesh, table, pattern, first, count, fps, interpolation, repeat, base, read })
}
