//! Animations of a file: which nodes they move, and by which curves.
use super::asset::{Asset, one_line};
use super::curve::Curve;
use super::node::{Local, Tree};
use crate::error::Result;
use crate::scene::load::few;
use glam::{DQuat, DVec3};
use gltf_json::animation::{Animation, Channel as Json, Property};
use gltf_json::validation::Checked;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::Arc;

/// A part of a node that moves.
#[derive(Clone, Debug)]
pub struct Channel {
    /// The node.
    pub node: usize,
    property: Property,
    curve: Arc<Curve>,
}

impl Channel {
    /// Whether it changes the weights of morph targets, not where the node is.
    pub fn is_morph(&self) -> bool {
        self.property == Property::MorphTargetWeights
    }

    /// Time of the last key in seconds.
    pub fn end(&self) -> f64 {
        self.curve.end()
    }

    /// Seconds between which it moves, if it does.
    pub fn moving(&self) -> Option<Range<f64>> {
        self.curve.moving()
    }

    /// The weights at a time.
    pub fn weights(&self, seconds: f64) -> Vec<f32> {
        self.curve.at(seconds).into_iter().map(|weight| weight as f32).collect()
    }

    /// Moves its node to where it is at a time.
    pub fn apply(&self, seconds: f64, locals: &mut [Local]) {
        let Local::Steps { translation, rotation, scale } = &mut locals[self.node] else { return };
        let value = self.curve.at(seconds);
        match self.property {
            Property::Translation => *translation = DVec3::from_slice(&value),
            Property::Rotation => *rotation = DQuat::from_slice(&value),
            Property::Scale => *scale = DVec3::from_slice(&value),
            Property::MorphTargetWeights => {}
        }
    }
}

/// The channels of the animation that is called `clip`, or of all that can be played together: an animation that moves what an
/// earlier one moves is left out. What cannot be played is named in `warnings`, one line for each animation.
///
/// # Errors
/// [`crate::error::Error::Input`] for a clip that is not there, [`crate::error::Error::Memory`].
pub fn read(asset: &Asset, tree: &Tree, clip: Option<&str>, warnings: &mut Vec<String>) -> Result<Vec<Channel>> {
    let (mut played, mut taken, mut left) = (Vec::new(), HashSet::new(), Vec::new());
    let named = |(index, animation): (usize, &Animation)| match animation.name.as_deref().map(one_line) {
        Some(name) if !name.is_empty() => name,
        _ => format!("animation {index}"),
    };
    let names: Vec<_> = asset.root.animations.iter().enumerate().map(named).collect();
    if let Some(clip) = clip.filter(|clip| !names.iter().any(|name| name == clip)) {
        return Err(asset.at(format!("clip \"{clip}\""), missing(&names)));
    }
    for (animation, name) in asset.root.animations.iter().zip(names) {
        if clip.is_some_and(|clip| name != clip) {
            continue;
        }
        let (channels, fault) = channels(asset, tree, animation)?;
        warnings.extend(fault.map(|what| format!("animation \"{name}\": {what}")));
        let parts: Vec<_> = channels.iter().map(|channel| (channel.node, channel.property as u32)).collect();
        if parts.iter().any(|part| taken.contains(part)) {
            left.push(name);
            continue;
        }
        taken.extend(parts);
        played.extend(channels);
    }
    if !left.is_empty() {
        let names = few(&left);
        warnings.push(format!("not played, since an earlier animation moves the same (a clip can be chosen): {names}"));
    }
    Ok(played)
}

/// What is said of a clip that is not among those of these names.
fn missing(names: &[String]) -> String {
    match names.is_empty() {
        true => "is not there: the file has no animations".to_owned(),
        false => format!("is not there: choose one of {}", few(names.iter().map(|name| format!("\"{name}\"")))),
    }
}

/// The channels of an animation, and a sentence about those that cannot be played.
fn channels(asset: &Asset, tree: &Tree, animation: &Animation) -> Result<(Vec<Channel>, Option<String>)> {
    let (mut found, mut first, mut faults) = (Vec::new(), None, 0);
    let mut curves: HashMap<(usize, usize), Arc<Curve>> = HashMap::new();
    for (index, json) in animation.channels.iter().enumerate() {
        match channel(asset, tree, animation, json, &mut curves)? {
            Ok(channel) => found.push(channel),
            Err(what) => {
                faults += 1;
                first.get_or_insert_with(|| format!("channel {index} {what}"));
            }
        }
    }
    let fault = first.map(|what| match faults {
        1 => format!("{what}; it is not played"),
        _ => format!("{what}; it and {} more are not played", faults - 1),
    });
    Ok((found, fault))
}

/// A channel, or a sentence about why it cannot be played. Curves are shared by sampler and width.
fn channel(
    asset: &Asset,
    tree: &Tree,
    animation: &Animation,
    json: &Json,
    curves: &mut HashMap<(usize, usize), Arc<Curve>>,
) -> Result<std::result::Result<Channel, String>> {
    let (node, sampler) = (json.target.node.value(), json.sampler.value());
    let Checked::Valid(property) = json.target.path else { return Ok(Err("moves what glTF does not know".into())) };
    let Some(holder) = asset.root.nodes.get(node) else {
        return Ok(Err(format!("moves node {node}, which is not there")));
    };
    let Some(keys) = animation.samplers.get(sampler) else {
        return Ok(Err(format!("names sampler {sampler} of {}", animation.samplers.len())));
    };
    let targets = || {
        let mesh = &asset.root.meshes[holder.mesh?.value()];
        mesh.primitives.iter().filter_map(|primitive| Some(primitive.targets.as_ref()?.len())).max()
    };
    let width = match property {
        Property::Translation | Property::Scale => 3,
        Property::Rotation => 4,
        Property::MorphTargetWeights => targets().unwrap_or(0),
    };
    if width == 0 {
        return Ok(Err(format!("moves morph targets of node {node}, which has none")));
    }
    if property != Property::MorphTargetWeights && matches!(tree.locals[node], Local::Matrix(_)) {
        return Ok(Err(format!("moves node {node}, which has a matrix")));
    }
    if let Some(curve) = curves.get(&(sampler, width)) {
        return Ok(Ok(Channel { node, property, curve: curve.clone() }));
    }
    let read = Curve::read(asset, keys, width, property == Property::Rotation)?;
    Ok(read.map(|curve| {
        let curve = Arc::new(curve);
        curves.insert((sampler, width), curve.clone());
        Channel { node, property, curve }
    }))
}
