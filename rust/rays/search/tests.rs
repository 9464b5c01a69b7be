use super::*;
use crate::numeric::simd::{Kernel, Level};
use crate::rays::camera::ImagePlane;
use crate::rays::packet::PACKET;
use crate::rays::scene::NO_BODY;
use crate::rays::scene::tests::furnished;

/// Hits of a tile, of all packets and of those of a mask.
struct Both<'a> {
    scene: &'a PosedScene,
    plane: &'a ImagePlane,
    tile: usize,
    packets: u32,
}

impl Kernel for Both<'_> {
    type Output = [Option<Box<Scratch>>; 2];

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Self::Output {
        let tile = self.plane.tile(self.tile);
        let mut both = [Box::new(Scratch::new()), Box::new(Scratch::new())];
        let mut is_empty = [false; 2];
        for (i, scratch) in both.iter_mut().enumerate() {
            scratch.rays.aim::<I>(self.plane, &tile);
            if i == 1 {
                scratch.rays.keep(self.packets);
            }
            is_empty[i] = self.scene.search::<I>(scratch, &Cast::default());
            self.scene
                .measure::<I>(&scratch.rays, &scratch.hits, &mut scratch.distance);
        }
        let [whole, part] = both;
        [(!is_empty[0]).then_some(whole), (!is_empty[1]).then_some(part)]
    }
}

#[test]
fn packets_that_are_kept_hit_what_they_hit_in_the_whole_tile() {
    let (surfaces, poses) = furnished();
    let scene = PosedScene::new(surfaces, poses);
    let plane = ImagePlane::centered(53, 61, 0.8, 0.8);
    let mut num_hits = 0;
    for level in Level::available() {
        for tile in 0..plane.num_tiles() {
            let packets = tile as u32 % 16;
            let [whole, part] = level.run(Both {
                scene: &scene,
                plane: &plane,
                tile,
                packets,
            });
            let Some(part) = part else {
                // Nothing is there, or nothing is wanted.
                let whole = whole.is_some_and(|whole| {
                    (0..PACKETS)
                        .any(|i| packets >> i & 1 == 1 && whole.hits.body[i].iter().any(|body| *body != NO_BODY))
                });
                assert!(!whole);
                continue;
            };
            let whole = whole.unwrap();
            for packet in 0..PACKETS {
                let rays = packet * PACKET..(packet + 1) * PACKET;
                if packets >> packet & 1 == 0 {
                    assert_eq!(part.rays.valid[packet], 0);
                    assert!(part.distance[rays].iter().all(|distance| distance.is_infinite()));
                    continue;
                }
                assert_eq!(part.hits.body[packet], whole.hits.body[packet]);
                assert_eq!(part.hits.triangle[packet], whole.hits.triangle[packet]);
                assert_eq!(part.distance[rays.clone()], whole.distance[rays]);
                num_hits += part.hits.body[packet].iter().filter(|body| **body != NO_BODY).count();
            }
        }
    }
    assert!(num_hits > 1000);
}
