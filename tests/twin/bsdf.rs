//! Compares the shading functions on the device with their CPU twins: random words exactly, radiometry within tolerances.
use crate::support::kernels::{bsdf, sampler};
use crate::support::{assert_silent, gpu};
use glam::{Vec2, Vec3, Vec4, vec2, vec3};
use std::sync::LazyLock;
use tallow::error::Result;
use tallow::gpu::{Buffer, FrameResources, Gpu, Location};
use tallow::layout::{
    BSDF_COATED, BSDF_CONDUCTOR, BSDF_DIELECTRIC, BSDF_DIFFUSE, BSDF_METALLIC, Effects, MATERIAL_GGX,
    MATERIAL_NONLINEAR, Material, TestPush,
};
use tallow::scene::{coat_table, mean_internal_fresnel, microfacet_table};
use tallow::twins::bsdf::{Bsdf, bsdf_albedo, bsdf_evaluate, bsdf_is_delta, bsdf_sample};
use tallow::twins::sampler::{sample_2d, sample_2d_bits, sampler_start};

const CASES: usize = 20_000;
/// [`Material`], (wo, wi, (u_lobe, u), normal of the clear coat).
type Case = (Material, [Vec3; 4]);

fn numbers(case: usize, pair: u32) -> Vec2 {
    sample_2d(sampler_start(case as u32, 0, 5, true), pair)
}

fn direction(u: Vec2) -> Vec3 {
    tallow::math::warp::warp_sphere(u)
}

const TABLES: usize = 3;

/// Of rough coats, one after another, and of metallic microfacets, as a scene's texels hold them. Which coat gets which does not
/// matter here.
fn tables() -> &'static [u32] {
    static WORDS: LazyLock<Vec<u32>> = LazyLock::new(|| {
        let tables: [_; TABLES] = [(1.5, false), (1.8, true), (0.8, true)].map(|(eta, ggx)| coat_table(eta, ggx));
        tables.concat().into_iter().map(f32::to_bits).chain(microfacet_table().iter().copied()).collect()
    });
    &WORDS
}

/// Materials and directions of every kind; every eighth case has an extreme incidence, index or roughness.
fn cases(kinds: &[u32], ggx: &[u32]) -> Vec<Case> {
    let case = |i: usize| {
        let kind = kinds[i % kinds.len()];
        let [a, b, c, d] = [0, 1, 2, 3].map(|pair| numbers(i, pair));
        let [wo, wi, u] = [direction(numbers(i, 4)), direction(numbers(i, 5)), numbers(i, 6).extend(numbers(i, 7).x)];
        let extreme = i.is_multiple_of(8);
        let z = [1e-7, 1e-4, 1.0][i / 8 % 3];
        let wo = if extreme { vec3((1.0f32 - z * z).sqrt(), 0.0, z) } else { wo };
        let eta = if extreme { [1.0, 0.7, 2.4][i / 24 % 3] } else { 1.1 + a.x };
        let material = Material {
            kind,
            base_color: [a.y, b.x, b.y],
            alpha: if extreme { [0.0, 0.01, 1.0][i / 72 % 3] } else { 0.05 + 0.9 * c.x },
            eta: [eta, eta * 0.7, eta * 0.3],
            k: [4.0 * c.y, 3.0, 0.0],
            specular: [1.0, d.x, d.y],
            transmission: [d.y, 1.0, d.x],
            internal_fresnel: mean_internal_fresnel(eta),
            flags: if ggx[i / 4 % ggx.len()] == 1 { MATERIAL_GGX } else { 0 }
                | if i / 16 % 3 == 1 { MATERIAL_NONLINEAR } else { 0 },
            metallic: [0.0, 1.0, c.x][i / 5 % 3],
            specular_factor: if (i / 7).is_multiple_of(2) { 1.0 } else { d.y },
            transmission_factor: if (i / 11).is_multiple_of(2) { 0.0 } else { a.y },
            clearcoat: if (i / 13).is_multiple_of(2) { 0.0 } else { a.x },
            clearcoat_alpha: if (i / 17).is_multiple_of(2) { 0.0 } else { b.x },
            coat_table: (if kind == BSDF_METALLIC { TABLES } else { i % TABLES } * microfacet_table().len()) as u32,
            anisotropy: match kind {
                BSDF_CONDUCTOR | BSDF_DIELECTRIC if i / 19 % 2 == 1 => [-0.7, 1.5][i / 38 % 2],
                _ => 0.0,
            },
            ..Material::default()
        };
        // Half of the coats are tilted, unless the viewer would be below them.
        let tilt = vec3(a.x - 0.5, b.x - 0.5, 1.0).normalize();
        let coat = if (i / 23).is_multiple_of(2) || tilt.dot(wo) < 1e-3 { Vec3::Z } else { tilt };
        (material, [wo, wi, u, coat])
    };
    (0..CASES).map(case).collect()
}

fn bsdf_of((material, [.., coat]): &Case) -> Bsdf {
    let mut b = Bsdf::new(material, material.alpha, tables());
    b.metallic.coat_normal = *coat;
    b
}

/// What `glsl/test/bsdf.comp` writes for one case.
fn twin(case: &Case) -> [Vec4; 5] {
    let (b, [wo, wi, u, _]) = (bsdf_of(case), &case.1);
    let (sampled, s) = bsdf_sample(&b, *wo, u.x, vec2(u.y, u.z));
    let flag = |on: bool| f32::from(u8::from(on));
    [
        bsdf_evaluate(&b, *wo, *wi),
        s.wi.extend(flag(sampled)),
        s.weight.extend(s.pdf),
        bsdf_albedo(&b, wo.z).extend(flag(bsdf_is_delta(&b))),
        bsdf_evaluate(&b, *wo, s.wi),
    ]
}

fn on_device(gpu: &Gpu, effects: &Effects, cases: &[Case]) -> Result<Vec<[Vec4; 5]>> {
    let kernel = bsdf::Kernel::new(gpu, &bsdf::Constants { effects: *effects })?;
    let materials: Vec<Material> = cases.iter().map(|c| c.0).collect();
    let inputs: Vec<[f32; 3]> = cases.iter().flat_map(|c| c.1.map(|v| v.to_array())).collect();
    let materials = Buffer::from_slice(gpu, "materials", &materials)?;
    let inputs = Buffer::from_slice(gpu, "inputs", &inputs)?;
    let made = if effects.many_texels { Buffer::from_wide_texels } else { Buffer::from_texels };
    let texels = made(gpu, "texels", tables())?;
    let results = Buffer::new(gpu, "results", 5 * cases.len(), Location::Readback)?;
    let push = TestPush { count: cases.len() as u32, seed: 0, ..Default::default() };
    let groups = [push.count.div_ceil(64), 1, 1];
    let bind = bsdf::Bind { materials: &materials, inputs: &inputs, results: &results, texels: &texels };
    gpu.run(&mut FrameResources::new(gpu)?, |rec| rec.dispatch(&kernel, bind, &push, groups))?;
    Ok(results.read()?.chunks_exact(5).map(|r| [0, 1, 2, 3, 4].map(|i| Vec4::from(r[i]))).collect())
}

/// Agreement of one case: 0.2 %, but for values that rounding at a lobe's flank moves; `sampled` decides whether a
/// sample holds anything. What is evaluated at the sampled direction is so at the device's own: lobes may be narrower than their
/// directions agree.
fn agrees(device: &[Vec4; 5], case: &Case) -> bool {
    let host = twin(case);
    let close = |a: Vec4, b: Vec4| (a - b).abs().cmple(Vec4::splat(2e-3 * b.abs().max_element() + 1e-5)).all();
    let absorbed = device[1].w == 0.0 && host[1].w == 0.0;
    let evaluated = || bsdf_evaluate(&bsdf_of(case), case.1[0], device[1].truncate());
    close(device[0], host[0])
        && close(device[3], host[3])
        && (absorbed || [1, 2].iter().all(|&i| close(device[i], host[i])) && close(device[4], evaluated()))
}

fn disagreements(device: &[[Vec4; 5]], cases: &[Case]) -> Vec<usize> {
    (0..cases.len()).filter(|&i| !agrees(&device[i], &cases[i])).collect()
}

/// A scene with these alone.
fn only(kinds: &[u32], beckmann: bool, ggx: bool) -> Effects {
    let has = |kind| kinds.contains(&kind);
    Effects {
        diffuse: has(BSDF_DIFFUSE) || has(BSDF_COATED),
        conductor: has(BSDF_CONDUCTOR),
        dielectric: has(BSDF_DIELECTRIC),
        metallic: has(BSDF_METALLIC),
        clearcoat: has(BSDF_METALLIC),
        coat_normals: has(BSDF_METALLIC),
        anisotropic: has(BSDF_CONDUCTOR) || has(BSDF_DIELECTRIC),
        thin_walls: has(BSDF_METALLIC),
        coated: has(BSDF_COATED),
        rough: true,
        smooth_interface: true,
        beckmann,
        ggx,
        ..Effects::default()
    }
}

#[test]
fn bsdfs_equal_their_twins() -> Result<()> {
    let gpu = gpu();
    let all = [BSDF_DIFFUSE, BSDF_CONDUCTOR, BSDF_DIELECTRIC, BSDF_COATED, BSDF_METALLIC];
    let runs: [(&[u32], &[u32]); 6] = [
        (&all, &[0, 1]),
        (&all[..1], &[0]),
        (&all[1..2], &[0]),
        (&all[2..3], &[1]),
        (&all[3..4], &[0]),
        (&all[4..], &[1]),
    ];
    for (kinds, ggx) in runs {
        let cases = cases(kinds, ggx);
        let special = on_device(&gpu, &only(kinds, ggx.contains(&0), ggx.contains(&1)), &cases)?;
        // A lobe choice or a horizon may fall on the other side by rounding: a few in a thousand cases.
        let differ = disagreements(&special, &cases);
        let first = differ.first().map(|&i| (&cases[i], special[i], twin(&cases[i])));
        println!("kinds {kinds:?} ggx {ggx:?}: {} of {CASES} differ", differ.len());
        assert!(differ.len() <= CASES / 300, "kinds {kinds:?}: {} differ, first {first:?}", differ.len());
        let finite = |r: &[Vec4; 5]| r[0].is_finite() && (r[1].w == 0.0 || r[1..].iter().all(|v| v.is_finite()));
        assert!(special.iter().all(finite));
        // What a scene lacks changes nothing when it is compiled in.
        let general = on_device(&gpu, &Effects::ALL, &cases)?;
        assert!(disagreements(&general, &cases).len() <= CASES / 300, "kinds {kinds:?} with every effect");
        // Control: 1 % more albedo and tint.
        let mut planted = cases.clone();
        planted.iter_mut().for_each(|c| (c.0.base_color[1], c.0.specular[0]) = (c.0.base_color[1] * 1.01, 1.01));
        assert!(disagreements(&special, &planted).len() > CASES / 10, "control");
        if kinds == [BSDF_METALLIC] {
            // Controls: a little of each of its own numbers.
            let of = |plant: fn(&mut Material)| {
                let mut planted = cases.clone();
                planted.iter_mut().for_each(|c| plant(&mut c.0));
                disagreements(&special, &planted).len()
            };
            let plants: [fn(&mut Material); 5] = [
                |m| m.metallic *= 0.98,
                |m| m.specular_factor *= 0.95,
                |m| m.transmission_factor *= 0.95,
                |m| m.clearcoat *= 0.95,
                |m| m.clearcoat_alpha *= 0.9,
            ];
            assert!(plants.iter().all(|&plant| of(plant) > CASES / 50), "control: {:?}", plants.map(of));
            let mut planted = cases.clone();
            planted.iter_mut().for_each(|c| c.1[3] = Vec3::Z);
            assert!(disagreements(&special, &planted).len() > CASES / 50, "control: coats that are not tilted");
        }
        if kinds == [BSDF_CONDUCTOR] {
            let mut planted = cases.clone();
            planted.iter_mut().for_each(|c| c.0.anisotropy *= 0.95);
            assert!(disagreements(&special, &planted).len() > CASES / 20, "control: another roughness along y");
        }
        if kinds.contains(&BSDF_COATED) {
            // Control: another coat's table, and light that keeps the base's colour once.
            let of = |plant: fn(&mut Material)| {
                let mut planted = cases.clone();
                planted.iter_mut().for_each(|c| plant(&mut c.0));
                disagreements(&special, &planted).len()
            };
            assert!(of(|m| m.coat_table = 0) > CASES / 50, "control");
            assert!(of(|m| m.flags &= !MATERIAL_NONLINEAR) > CASES / 50, "control");
        }
    }
    assert_silent(&gpu);
    Ok(())
}

/// Of an index of zero, whose amplitudes are 0 / 0 head on.
#[test]
fn a_conductor_of_index_zero_reflects_all_on_the_device_too() -> Result<()> {
    let case = |i: usize| {
        let z = [1.0f32, 0.9, 1e-4][i % 3];
        let wo = vec3((1.0 - z * z).sqrt(), 0.0, z);
        let (alpha, specular) = ([0.0, 0.3][i / 3 % 2], [1.0; 3]);
        let (eta, k) = ([0.0, 0.0, 1.0], [0.0, 1e-30, 0.0]);
        let material = Material { kind: BSDF_CONDUCTOR, alpha, specular, eta, k, ..Material::default() };
        (material, [wo, vec3(-wo.x, 0.0, z), numbers(i, 0).extend(numbers(i, 1).x), Vec3::Z])
    };
    let cases: Vec<Case> = (0..60).map(case).collect();
    let gpu = gpu();
    let found = on_device(&gpu, &only(&[BSDF_CONDUCTOR], true, false), &cases)?;
    let finite = |r: &[Vec4; 5]| r[0].is_finite() && (r[1].w == 0.0 || r[1..].iter().all(|v| v.is_finite()));
    assert!(found.iter().all(finite), "{found:?}");
    assert_eq!(disagreements(&found, &cases), [0; 0]);
    for (r, (m, _)) in found.iter().zip(&cases).filter(|(r, (m, _))| m.alpha == 0.0 && r[1].w == 1.0) {
        assert!((r[2].truncate() - vec3(1.0, 1.0, 0.0)).abs().max_element() < 1e-5, "{m:?} {r:?}");
    }
    assert_silent(&gpu);
    Ok(())
}

#[test]
fn random_words_equal_their_twin() -> Result<()> {
    let gpu = gpu();
    let word = |i: u32, pair: u32| sample_2d_bits(sampler_start(i, 0, 1, true), pair);
    let mut queries: Vec<[u32; 3]> = (0..4096).map(|i| [word(i, 0)[0], word(i, 0)[1], word(i, 1)[0]]).collect();
    queries.extend((0..4096).map(|i| [i, i % 64, i % 7]));
    let input = Buffer::from_slice(&gpu, "queries", &queries)?;
    let words = Buffer::new(&gpu, "words", queries.len(), Location::Readback)?;
    let floats = Buffer::new(&gpu, "floats", queries.len(), Location::Readback)?;
    let push = TestPush { count: queries.len() as u32, seed: 77, ..Default::default() };
    for independent_sampler in [false, true] {
        let effects = Effects { independent_sampler, ..Effects::ALL };
        let kernel = sampler::Kernel::new(&gpu, &sampler::Constants { effects })?;
        let bind = sampler::Bind { queries: &input, words: &words, floats: &floats };
        let groups = [push.count.div_ceil(64), 1, 1];
        gpu.run(&mut FrameResources::new(&gpu)?, |rec| rec.dispatch(&kernel, bind, &push, groups))?;
        let stream = |q: &[u32; 3], seed: u32| sampler_start(q[0], q[1], seed, independent_sampler);
        let twin =
            |seed: u32| -> Vec<[u32; 2]> { queries.iter().map(|q| sample_2d_bits(stream(q, seed), q[2])).collect() };
        assert_eq!(words.read()?, twin(77));
        assert_ne!(words.read()?, twin(78), "control");
        let twin: Vec<[f32; 2]> = queries.iter().map(|q| sample_2d(stream(q, 77), q[2]).to_array()).collect();
        assert_eq!(floats.read()?, twin);
    }
    assert_silent(&gpu);
    Ok(())
}
