/// Meshes of COLLADA files (.dae), by assimp: all triangles of the scene, moved to where its nodes place them, lengths in
/// metres by the file's unit. The axis that the file says is up does not turn it, as ROS takes such files. Lines and
/// points are passed over.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#include "mesh.h"

#ifdef CAVORT_LOADS_ASSIMP
#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "library.h"

// clang-format off
#define FUNCTIONS(X) \
  X(aiCreatePropertyStore) X(aiReleasePropertyStore) X(aiSetImportPropertyInteger) X(aiImportFileExWithProperties) \
  X(aiReleaseImport) X(aiGetErrorString)
// clang-format on

typedef struct functions {
  FUNCTIONS(CAV_LIBRARY_POINTER)
} functions;

static const cav_library library = {"assimp", CAVORT_LOADS_ASSIMP, "libassimp-dev", {FUNCTIONS(CAV_LIBRARY_NAME) NULL}};

enum { FILE_LIMIT = 128 << 20, VERTEX_LIMIT = 3000000 };

static int count(const struct aiScene *scene, size_t *vertices) {
  size_t triangles = 0;
  *vertices = 0;
  for (unsigned i = 0; i < scene->mNumMeshes; i++) {
    const struct aiMesh *mesh = scene->mMeshes[i];
    *vertices += mesh->mNumVertices;
    for (unsigned f = 0; f < mesh->mNumFaces; f++) triangles += mesh->mFaces[f].mNumIndices == 3;
  }
  return triangles > VERTEX_LIMIT || *vertices > VERTEX_LIMIT ? -1 : (int)triangles;
}

static cav_status copy(const struct aiScene *scene, cav_triangles *m, char *reason, size_t room) {
  size_t vertices;
  int triangles = count(scene, &vertices);
  if (triangles <= 0) {
    if (triangles)
      snprintf(reason, room, "more than %d vertices; make the mesh coarser", VERTEX_LIMIT);
    else
      snprintf(reason, room, "it holds no triangle");
    return CAV_BAD_INPUT;
  }
  m->vertex = malloc(3 * vertices * sizeof *m->vertex);
  m->triangle = malloc(3 * (size_t)triangles * sizeof *m->triangle);
  if (!m->vertex || !m->triangle) {
    snprintf(reason, room, "no memory for the mesh");
    return CAV_NO_MEMORY;
  }
  for (unsigned i = 0; i < scene->mNumMeshes; i++) {
    const struct aiMesh *mesh = scene->mMeshes[i];
    int first = m->nvertex;
    for (unsigned k = 0; k < mesh->mNumVertices; k++) {
      const struct aiVector3D *x = &mesh->mVertices[k];
      double *to = m->vertex + 3 * (size_t)m->nvertex++;
      to[0] = (double)x->x, to[1] = (double)x->y, to[2] = (double)x->z;
      if (!isfinite(to[0]) || !isfinite(to[1]) || !isfinite(to[2])) {
        snprintf(reason, room, "vertex %u of its mesh '%.60s' is not finite", k + 1, mesh->mName.data);
        return CAV_BAD_INPUT;
      }
    }
    for (unsigned f = 0; f < mesh->mNumFaces; f++) {
      if (mesh->mFaces[f].mNumIndices != 3) continue;
      int *to = m->triangle + 3 * (size_t)m->ntriangle++;
      for (int k = 0; k < 3; k++) to[k] = first + (int)mesh->mFaces[f].mIndices[k];
    }
  }
  return CAV_OK;
}

cav_status cav_mesh_read_dae(const char *path, cav_triangles *m, char *reason, size_t room) {
  functions call;
  struct stat info;
  cav_status status = cav_library_load(&library, &call, sizeof call, reason, room);
  if (status) return status;
  if (stat(path, &info) || !S_ISREG(info.st_mode) || info.st_size > FILE_LIMIT) {
    snprintf(reason, room, "expected a file of at most %d MB", FILE_LIMIT >> 20);
    return CAV_BAD_INPUT;
  }
  struct aiPropertyStore *store = call.aiCreatePropertyStore();
  if (store) call.aiSetImportPropertyInteger(store, AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, 1);
  const struct aiScene *scene = store ? call.aiImportFileExWithProperties(
                                            path, aiProcess_Triangulate | aiProcess_PreTransformVertices, NULL, store)
                                      : NULL;
  if (!scene) {
    snprintf(reason, room, "is not a COLLADA file that assimp reads: %.200s", call.aiGetErrorString());
    status = CAV_BAD_INPUT;
  } else {
    status = copy(scene, m, reason, room);
    call.aiReleaseImport(scene);
  }
  if (store) call.aiReleasePropertyStore(store);
  if (status) cav_triangles_clear(m);
  return status;
}

#else

cav_status cav_mesh_read_dae(const char *path, cav_triangles *m, char *reason, size_t room) {
  (void)path, (void)m;
  snprintf(
      reason, room,
      "is a COLLADA file, which this build is without assimp to read; build with -Dcollada=enabled, or convert it to "
      ".stl or .obj");
  return CAV_NOT_SUPPORTED;
}

#endif
