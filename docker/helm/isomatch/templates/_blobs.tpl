{{/* The folder that gateways and workers share. Mounted for writing also when it is read
     only: files that no row names any more still go. */}}
{{- define "isomatch.blobFolder" -}}/blobs{{- end -}}

{{- define "isomatch.blobEnv" -}}
{{- if .Values.blobs.claimName }}
- name: ISOMATCH_BLOB_DIR
  value: {{ include "isomatch.blobFolder" . }}
- name: ISOMATCH_BLOB_DIR_READ_ONLY
  value: {{ .Values.blobs.readOnly | quote }}
{{- end }}
{{- end -}}

{{- define "isomatch.blobMounts" -}}
{{- if .Values.blobs.claimName }}
- name: blobs
  mountPath: {{ include "isomatch.blobFolder" . }}
{{- end }}
{{- end -}}

{{- define "isomatch.blobVolumes" -}}
{{- if .Values.blobs.claimName }}
- name: blobs
  persistentVolumeClaim:
    claimName: {{ .Values.blobs.claimName }}
{{- end }}
{{- end -}}
