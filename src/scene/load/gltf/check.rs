//! Checks that what a glTF file names is there, before anything is made of it. What the parts hold is checked where they are
//! read.
use super::accessor::Elements;
use super::asset::Asset;
use crate::error::Result;
use gltf_json::scene::Node;
use gltf_json::{Index, Skin};

/// An index that is left out where a texture has no picture that this loader knows.
const NO_SOURCE: usize = u32::MAX as usize;

/// Checks every accessor, and every index of scenes, nodes, meshes, textures and skins.
///
/// # Errors
/// [`crate::error::Error::Input`] with the first that does not fit.
pub fn check(asset: &Asset) -> Result<()> {
    let root = &asset.root;
    (0..root.accessors.len()).try_for_each(|index| Elements::of(asset, index).map(|_| ()))?;
    let below = Below(asset);
    below.all("the file", "scene", root.scenes.len(), root.scene.iter())?;
    for (index, scene) in root.scenes.iter().enumerate() {
        below.all(&format!("scene {index}"), "node", root.nodes.len(), &scene.nodes)?;
    }
    root.nodes.iter().enumerate().try_for_each(|(index, node)| below.node(index, node))?;
    for (index, mesh) in root.meshes.iter().enumerate() {
        let place = format!("mesh {index}");
        for primitive in &mesh.primitives {
            below.all(&place, "material", root.materials.len(), &primitive.material)?;
            below.all(&place, "accessor", root.accessors.len(), primitive.attributes.values())?;
            below.all(&place, "accessor", root.accessors.len(), &primitive.indices)?;
            let targets = primitive.targets.iter().flatten();
            let of_target = targets.flat_map(|t| t.positions.iter().chain(&t.normals).chain(&t.tangents));
            below.all(&place, "accessor", root.accessors.len(), of_target)?;
        }
    }
    for (index, texture) in root.textures.iter().enumerate() {
        let (place, source) = (format!("texture {index}"), Some(texture.source).filter(|s| s.value() != NO_SOURCE));
        below.all(&place, "sampler", root.samplers.len(), &texture.sampler)?;
        below.all(&place, "image", root.images.len(), &source)?;
    }
    root.skins.iter().enumerate().try_for_each(|(index, skin)| below.skin(index, skin))
}

struct Below<'a>(&'a Asset<'a>);

impl Below<'_> {
    fn node(&self, index: usize, node: &Node) -> Result<()> {
        let (root, place) = (&self.0.root, format!("node {index}"));
        self.all(&place, "node", root.nodes.len(), node.children.iter().flatten())?;
        self.all(&place, "mesh", root.meshes.len(), &node.mesh)?;
        self.all(&place, "camera", root.cameras.len(), &node.camera)?;
        self.all(&place, "skin", root.skins.len(), &node.skin)
    }

    fn skin(&self, index: usize, skin: &Skin) -> Result<()> {
        let (root, place) = (&self.0.root, format!("skin {index}"));
        self.all(&place, "node", root.nodes.len(), &skin.joints)?;
        self.all(&place, "accessor", root.accessors.len(), &skin.inverse_bind_matrices)
    }

    /// Checks that all of `indices`, which `place` holds, are below `count`.
    fn all<'i, T: 'i>(
        &self,
        place: &str,
        what: &str,
        count: usize,
        indices: impl IntoIterator<Item = &'i Index<T>>,
    ) -> Result<()> {
        match indices.into_iter().find(|index| index.value() >= count) {
            Some(index) => {
                Err(self.0.at(place, format!("names {what} {index}, and there are {count}: export it again")))
            }
            None => Ok(()),
        }
    }
}
