//! Numbers of instances and triangles that stay the same in every pose.
use super::Scene;

impl Scene {
    /// By index in [`Scene::instances`], a number of the instance that no pose changes.
    pub fn instance_numbers(&self) -> Vec<u32> {
        self.rig.order.clone()
    }

    /// By index in [`Scene::triangles`], a number of the triangle that no pose changes.
    pub fn triangle_numbers(&self) -> Vec<u32> {
        let mut numbers: Vec<u32> = (0..self.triangles.len() as u32).collect();
        for tree in self.rig.trees.iter().filter(|tree| tree.soft.is_some()) {
            numbers[tree.range.clone()].iter_mut().for_each(|index| *index = tree.number_of(*index));
        }
        numbers
    }
}
