// Ids of different kinds do not mix.
#include <gtest/gtest.h>

#include <type_traits>

#include "limn/edgetree/edge_sampler.h"

namespace limn {
namespace {

template <class A, class B>
constexpr bool kMixes = std::is_convertible_v<A, B> || std::is_constructible_v<B, A> ||
                        std::is_assignable_v<B&, A> || requires(A a, B b) {
  a < b;
}
|| requires(A a, B b) { a == b; };

template <class A, class... Others>
constexpr bool kIsAKindOfItsOwn =
    sizeof(A) == 4 && std::is_trivially_copyable_v<A>&& std::totally_ordered<A> &&
    !(kMixes<A, Others> || ...) && !std::is_convertible_v<uint32_t, A> &&
    !std::is_assignable_v<A&, uint32_t> && !std::is_constructible_v<uint32_t, A>;

static_assert(kIsAKindOfItsOwn<ShapeId, FaceId, EdgeId, VertexId>);
static_assert(kIsAKindOfItsOwn<FaceId, ShapeId, EdgeId, VertexId>);
static_assert(kIsAKindOfItsOwn<EdgeId, ShapeId, FaceId, VertexId>);
static_assert(kIsAKindOfItsOwn<VertexId, ShapeId, FaceId, EdgeId>);
static_assert(kMixes<FaceId, FaceId> && kMixes<int, double>);  // the test can fail

// What takes one kind takes no other, and a bare number is no index of an EdgeMesh's.
template <class I>
constexpr bool kNamesAnEdge = requires(const EdgeMesh& mesh, I i) {
  mesh.edge(i);
}
|| requires(const EdgeMesh& mesh, I i) { mesh.faces_around(i); }
|| requires(const EdgeMesh& mesh, I i, Vec3d p) { is_candidate(mesh, i, p); };
static_assert(kNamesAnEdge<EdgeId>);
static_assert(!kNamesAnEdge<FaceId> && !kNamesAnEdge<ShapeId> && !kNamesAnEdge<VertexId> &&
              !kNamesAnEdge<uint32_t>);
template <class A, class B>
constexpr bool kMakesAFaceRef = requires(A a, B b) {
  FaceRef{a, b};
};
static_assert(kMakesAFaceRef<ShapeId, FaceId> && !kMakesAFaceRef<FaceId, ShapeId>);
static_assert(sizeof(FaceRef) == 8 && sizeof(EdgeRef) == 8);

TEST(Ids, NoneIsNoIndex) {
  EXPECT_FALSE(FaceId().valid());
  EXPECT_EQ(FaceId(), FaceId::none());
  EXPECT_TRUE(FaceId(0).valid());
  EXPECT_NE(FaceId(0), FaceId::none());
  EXPECT_EQ(FaceId(7).index(), 7u);
  EXPECT_LT(FaceId(6), FaceId(7));
  EXPECT_FALSE(FaceRef().shape.valid());
  EXPECT_FALSE(EdgeRef().edge.valid());
}

// A query that lies on no face has no edges of its own.
TEST(Ids, NoFaceHasNoEdges) {
  EdgeSamplerInput input;
  input.objects.emplace_back();
  input.objects[0].face_offsets = {0, 2};
  input.objects[0].incident_faces = {{ShapeId(0), FaceId(3)}, {ShapeId(0), FaceId(5)}};
  const EdgeRef edge{ShapeId(0), EdgeId(0)};
  EdgeQuery query;
  EXPECT_FALSE(is_own_edge(input, query, edge));
  query.face = {ShapeId(0), FaceId(5)};
  EXPECT_TRUE(is_own_edge(input, query, edge));
  query.face.face = FaceId(4);
  EXPECT_FALSE(is_own_edge(input, query, edge));
  query.face = {ShapeId(1), FaceId(5)};
  EXPECT_FALSE(is_own_edge(input, query, edge));
}

}  // namespace
}  // namespace limn
